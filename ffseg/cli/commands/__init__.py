"""One module for each subcommand: its options and help, its call, its exit code."""
