"""The command line: one file a command. Commands read arguments, call the API and print; nothing else does."""
