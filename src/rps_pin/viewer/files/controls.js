// Meshcat folds its panel away: open it with nothing but the playback controls unfolded.
viewer.gui.__folders["Scene"].close();
viewer.gui.open();
