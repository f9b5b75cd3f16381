// The playback controls of a page that plays a motion.
function addControls(viewer) {
  const panel = document.getElementById("playback");
  const animator = viewer.animator;
  const button = piece(panel, "button", "play");
  button.onclick = () => (animator.playing ? animator.pause() : animator.play());
  const slider = piece(panel, "input");
  Object.assign(slider, { type: "range", min: 0, max: animator.duration, step: "any" });
  slider.setAttribute("aria-label", "time");
  slider.oninput = () => {
    animator.pause();
    animator.seek(Number(slider.value));
  };
  const speed = piece(panel, "select");
  speed.title = "speed";
  for (const times of [0.1, 0.25, 0.5, 1, 2]) {
    const option = piece(speed, "option", "", `${times}×`);
    option.value = times;
    option.selected = times === 1;
  }
  speed.onchange = () => (animator.mixer.timeScale = Number(speed.value));
  const follow = () => {
    requestAnimationFrame(follow);
    const text = animator.playing ? "Pause" : "Play";
    if (button.textContent !== text) button.textContent = text;
    if (document.activeElement !== slider || animator.playing) {
      slider.value = Math.max(...animator.actions.map((action) => action.time));
    }
  };
  follow();
  panel.hidden = false;
}
addControls(viewer);
