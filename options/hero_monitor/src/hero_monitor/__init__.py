"""The fleet on a web page that shows the robots, stops them, and on request drives them."""
