"""Writers: a mechanism as a URDF with its description, and as a MuJoCo file."""
