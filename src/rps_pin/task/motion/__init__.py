"""The shortest time along a curve: of what moves under limits, whatever it is."""
