"""The files that export writes: tables per robot, or bags of other tools."""
