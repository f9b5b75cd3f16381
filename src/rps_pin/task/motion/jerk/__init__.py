"""The shortest time under limits of jerk: time laws of constant jerk, by linear programs."""
