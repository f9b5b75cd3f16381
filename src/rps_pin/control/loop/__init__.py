"""The control loop: laws, setpoints, filters, limits, status and clock."""
