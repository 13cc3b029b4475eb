"""The command line: verbs, progress, tables, exit codes. Heavy imports live inside the verbs."""
