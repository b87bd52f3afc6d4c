"""The command line: one file per verb, each with a ``main(arguments) -> exit status``."""
