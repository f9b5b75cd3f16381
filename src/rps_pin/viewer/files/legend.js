// The legend of the layers, with a tick for each: drawn anew whenever the scene sends one, as
// `userData` of /world. Their readings, and the time, are the `userData` of /readings; a page that
// plays a motion has all readings at once. See writers/meshcat_writer.py.
// Numbers are not parted from their units.
const QUANTITY = /\d (N m|[Nmsµ%]m?)(?![a-z])/g;
const READINGS = {};
let everyReading = {};

function piece(parent, kind, name = "", text = "") {
  const made = document.createElement(kind);
  made.className = name;
  made.textContent = text;
  parent.append(made);
  return made;
}
function drawLayers(viewer, layers) {
  const panel = document.getElementById("layers");
  const labels = document.getElementById("labels");
  panel.replaceChildren();
  labels.replaceChildren();
  document.getElementById("legend").hidden = !layers.length;
  for (const layer of layers) {
    const entry = piece(panel, "div");
    const label = piece(entry, "label");
    const tick = piece(label, "input");
    tick.type = "checkbox";
    tick.name = layer.name;
    tick.checked = layer.visible;
    piece(label, "span", "swatch").style.background = layer.colour;
    piece(label, "span", "", layer.text.replace(QUANTITY, (all) => all.replaceAll(" ", "\u00a0")));
    const more = piece(entry, "div");
    const bar = piece(more, "div", "bar");
    if (layer.colours) {
      piece(bar, "span", "", layer.low);
      piece(bar, "i").style.background = `linear-gradient(90deg, ${layer.colours.join(", ")})`;
      piece(bar, "span", "", layer.high);
    }
    const reading = { text: piece(more, "div", "reading"), label: null, at: layer.at };
    if (layer.at) reading.label = piece(labels, "div");
    READINGS[layer.name] = reading;
    const show = () => {
      entry.className = tick.checked ? "" : "off";
      more.hidden = !tick.checked;
      if (reading.label) reading.label.hidden = !tick.checked;
    };
    show();
    tick.onchange = () => {
      viewer.set_property(["world", "layers", layer.name], "visible", tick.checked);
      viewer.set_dirty();
      show();
    };
  }
  showReadings(READINGS.last || {});
  viewer.set_3d_pane_size();
}
function showReadings(texts) {
  READINGS.last = texts;
  for (const [name, text] of Object.entries(texts)) {
    const reading = READINGS[name];
    if (!reading) continue;
    reading.text.textContent = text;
    if (reading.label) reading.label.textContent = text;
  }
}
function showClock(time, longest) {
  const clock = document.getElementById("clock");
  const digits = Math.min(6, Math.max(2, 2 - Math.floor(Math.log10(longest || 1))));
  clock.textContent = `t = ${time.toFixed(digits)} s`;
  clock.hidden = false;
}
function placeLabels(viewer) {
  const free = freePart(document.getElementById("meshcat-pane"));
  const { width, height } = free.whole;
  const within = (x, low, high) => Math.max(low, Math.min(x, high));
  for (const { label, at } of Object.values(READINGS)) {
    if (!label) continue;
    const world = viewer.scene_tree.find(["world"]).object;
    const point = viewer.camera.position.clone().set(...at);
    point.applyMatrix4(world.matrixWorld).project(viewer.camera);
    const left = within((width * (1 + point.x)) / 2 + 8, 0, free.right - label.offsetWidth - 4);
    const top = within((height * (1 - point.y)) / 2, 0, free.bottom - label.offsetHeight - 4);
    label.style.transform = `translate(${left}px, ${top}px)`;
    label.style.visibility = point.z < 1 ? "visible" : "hidden";
  }
}
function watchLayers(viewer) {
  const set = viewer.set_property.bind(viewer);
  viewer.set_property = (path, property, value) => {
    set(path, property, value);
    if (property !== "userData") return;
    if (path.join("/") === "world") drawLayers(viewer, value.layers);
    if (path.join("/") !== "readings") return;
    everyReading = value.every || {};
    if (value.readings) showReadings(value.readings);
    if (value.time !== null && value.time !== undefined) showClock(value.time);
  };
  const setObject = viewer.set_object.bind(viewer);
  viewer.set_object = (path, object) => {
    const material = object.material;
    // Drawn where something else is in front of it: three.js's GreaterDepth.
    if (material && material.userData.through) material.depthFunc = 6;
    setObject(path, object);
  };
  const render = viewer.render.bind(viewer);
  viewer.render = () => {
    const { duration, actions } = viewer.animator;
    if (actions.length) {
      const time = Math.max(...actions.map((action) => action.time));
      const texts = Object.entries(everyReading).map(([name, all]) => [
        name, all[Math.round((time / duration) * (all.length - 1))],
      ]);
      showReadings(Object.fromEntries(texts));
      showClock(time, duration);
    }
    render();
    placeLabels(viewer);
  };
}
