"""The command line: its commands, their arguments, what it prints. It imports other rooms late."""
