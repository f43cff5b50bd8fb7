"""What a configuration will achieve, without running it."""
