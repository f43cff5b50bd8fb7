"""What every wing stands on: sections of the configuration, variables, stages, files."""
