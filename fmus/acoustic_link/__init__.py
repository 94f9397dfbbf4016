"""Messages from one vehicle to another."""
