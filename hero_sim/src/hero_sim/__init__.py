"""HeRo robots without hardware, behind the same TCP socket as the real ones."""
