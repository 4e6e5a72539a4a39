"""What tests watch of robots: their ground truth, lights and commands, and the reports of their driver."""
