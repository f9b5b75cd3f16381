// The robot in the part of the window that the legend and the bar leave free: the camera's picture
// is made for that part, and goes on below the others. The stage says which outline the robot has
// (see Stage.outline in scene/stage.py).
const MARGIN = 0.94;
function freePart(pane) {
  const whole = pane.getBoundingClientRect();
  const free = { left: 0, top: 0, right: whole.width, bottom: whole.height };
  const over = (element) => {
    const box = element.getBoundingClientRect();
    const covers = box.width > 0 && box.top < whole.bottom && box.left < whole.right;
    return covers && getComputedStyle(element).position === "absolute" ? box : null;
  };
  const legend = over(document.getElementById("legend"));
  const bar = over(document.getElementById("bar"));
  if (legend && document.getElementById("legend").open) free.left = legend.right - whole.left;
  if (bar) free.bottom = bar.top - whole.top;
  return { ...free, whole, width: free.right - free.left, height: free.bottom - free.top };
}
function keepRobotFree(viewer) {
  const pane = document.getElementById("meshcat-pane");
  const resize = viewer.set_3d_pane_size.bind(viewer);
  viewer.set_3d_pane_size = () => {
    const free = freePart(pane);
    const { width, height } = free.whole;
    if (!(width > 0 && height > 0)) return;
    resize(width, height);
    const camera = viewer.camera;
    const cameras = viewer.scene_tree.find(["Cameras"]).object;
    const [half, low, high] = cameras.userData.outline || [1, -1, 1];
    const tall = (MARGIN * 2) / (high - low);
    // No further to the right than the robot needs.
    const wide = (half * tall * free.height) / MARGIN;
    free.left = Math.max(0, Math.min(free.left, 2 * free.left + wide - width));
    free.width = free.right - free.left;
    camera.zoom = Math.min((MARGIN * free.width) / free.height / half, tall);
    const middle = (camera.zoom * free.height * (low + high)) / 4; // pixels above the camera's axis
    const top = -free.top - middle;
    camera.setViewOffset(free.width, free.height, -free.left, top, width, height);
    camera.updateProjectionMatrix();
    viewer.set_dirty();
  };
  const set = viewer.set_property.bind(viewer);
  viewer.set_property = (path, property, value) => {
    set(path, property, value);
    if (property === "userData" && path.join("/") === "Cameras") viewer.set_3d_pane_size();
  };
  const legend = document.getElementById("legend");
  const { innerWidth, innerHeight } = window;
  const wide = innerWidth >= 520 && innerWidth > innerHeight;
  legend.open = wide ? innerWidth >= 760 && innerHeight >= 400 : innerHeight >= 700;
  const again = new ResizeObserver(() => viewer.set_3d_pane_size());
  for (const id of ["meshcat-pane", "legend", "bar"]) again.observe(document.getElementById(id));
}
