"""What training and fitting share: configuration, SOAP, schedule, weight averaging, checkpoints, one loop."""
