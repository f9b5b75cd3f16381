"""The state estimate of a control loop: pose, twist and forces from encoders."""
