"""The methods of joining neighbouring skills (paper 4.1.2), a file each behind one protocol."""
