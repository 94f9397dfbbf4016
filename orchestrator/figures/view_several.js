// Frames of one vehicle follow those of the other, and so do frames of references.
function show(k) {
  frame = Math.max(0, Math.min(last, k));
  slider.value = frame;
  time.textContent = times[frame].toFixed(1) + " s";
  const { position, reference } = data.frames, x = [[], [], []];
  const add = (xs, ys, zs) => { x[0].push(xs); x[1].push(ys); x[2].push(zs); };
  for (let first = 0; first < position.length; first += times.length) {
    const path = position.slice(first, first + frame + 1);
    add(path.map(p => p[0]), path.map(p => p[1]), path.map(p => p[2]));
    data.parts.forEach(part => add(...placed(part, first + frame)));
  }
  for (let k = frame; k < reference.length; k += times.length) {
    const r = reference[k];
    add([r[0]], [r[1]], [r[2]]);
  }
  Plotly.restyle(scene, { x: x[0], y: x[1], z: x[2] }, data.moving);
  Plotly.relayout(series, { "shapes[0].x0": times[frame], "shapes[0].x1": times[frame] });
}

// The vehicle whose errors, commands, estimates and velocities are below those of all.
function chosen(k) {
  const { traces, layout, narrow } = data.choices[k];
  return { traces: [...data.common, ...traces], layout, narrow };
}
const vehicle = document.getElementById("vehicle");
data.series = chosen(vehicle.value);
vehicle.onchange = () => {
  const { traces, layout } = chosen(vehicle.value);
  return Plotly.react(series, traces, layout, config).then(() => show(frame));
};
