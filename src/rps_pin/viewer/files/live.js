// Follows the scene of a server.
const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
keepRobotFree(viewer);
watchLayers(viewer);
viewer.connect("ws://" + location.host + "/socket");
viewer.connection.onclose = () => {
  document.getElementById("note").textContent =
    "No connection to the viewer any more; this is the last picture it showed.";
};
