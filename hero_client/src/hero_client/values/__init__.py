"""Values of programs: poses, readings, colors, errors, times. Pure."""
