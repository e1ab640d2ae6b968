"""What is asked: specs and suites, read from files and checked."""
