"""Input and output shared by all commands: flags, help, files, progress and parallel calls."""
