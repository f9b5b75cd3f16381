// Carries out the recorded commands of a page. Each command is decoded and carried out before the
// next: Meshcat's own static pages fetch() their commands, and then an object may arrive after the
// animation that moves it.
const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
keepRobotFree(viewer);
watchLayers(viewer);
for (const text of JSON.parse(document.getElementById("commands").textContent)) {
  viewer.handle_command_bytearray(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)));
}
