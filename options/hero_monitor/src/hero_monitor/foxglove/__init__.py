"""Live topics for Foxglove, Lichtblick and PlotJuggler, over their WebSocket protocol."""
