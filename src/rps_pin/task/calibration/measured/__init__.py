"""What is measured: instruments, and the files of them and of their readings."""
