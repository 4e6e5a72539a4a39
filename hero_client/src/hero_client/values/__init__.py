"""What programs compute with: poses, readings, colors, errors, times. Pure."""
