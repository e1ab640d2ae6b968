"""What is kept: the store of artifacts, the ledger, run directories, and what is read from them."""
