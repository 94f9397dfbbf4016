"""What all components share: declarations of ports and the hardened slave."""
