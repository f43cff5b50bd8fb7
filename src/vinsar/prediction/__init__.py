"""What a configuration will do, without running it."""
