"""The commands of the command line, in groups; what a command needs is loaded when it is called."""
