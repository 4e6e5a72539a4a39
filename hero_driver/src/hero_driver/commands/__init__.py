"""The commands to one robot: checked, shaped to what the firmware accepts, queued; and the progress of a stop. Pure."""
