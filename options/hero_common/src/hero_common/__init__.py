"""The stock package's name for the messages of HeRo."""
