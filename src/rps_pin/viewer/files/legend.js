// The legend of the layers, with a tick for each: drawn anew whenever the scene sends one, as
// `userData` of /world (see writers/meshcat_writer.py).
function drawLayers(viewer, layers) {
  const panel = document.getElementById("layers");
  const piece = (parent, kind, name = "", text = "") => {
    const made = document.createElement(kind);
    made.className = name;
    made.textContent = text;
    parent.append(made);
    return made;
  };
  panel.replaceChildren();
  panel.style.display = layers.length ? "block" : "none";
  for (const layer of layers) {
    const entry = piece(panel, "div", layer.visible ? "" : "off");
    const label = piece(entry, "label");
    const tick = piece(label, "input");
    tick.type = "checkbox";
    tick.name = layer.name;
    tick.checked = layer.visible;
    piece(label, "span", "swatch").style.background = layer.colour;
    piece(label, "span", "", layer.text);
    const bar = piece(entry, "div", "bar");
    if (layer.colours) {
      piece(bar, "span", "", layer.low);
      piece(bar, "i").style.background = `linear-gradient(90deg, ${layer.colours.join(", ")})`;
      piece(bar, "span", "", layer.high);
    }
    bar.hidden = !layer.visible;
    tick.onchange = () => {
      viewer.set_property(["world", "layers", layer.name], "visible", tick.checked);
      viewer.set_dirty();
      entry.className = tick.checked ? "" : "off";
      bar.hidden = !tick.checked;
    };
  }
}
function watchLayers(viewer) {
  const set = viewer.set_property.bind(viewer);
  viewer.set_property = (path, property, value) => {
    set(path, property, value);
    if (property === "userData" && path.join("/") === "world") {
      drawLayers(viewer, value.layers);
    }
  };
}
