"""What orchestration must know of each benchmark, a file each, and the registry."""
