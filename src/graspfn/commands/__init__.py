"""What people type: one file a command, which loads nothing until it runs; what a command does may have its own."""
