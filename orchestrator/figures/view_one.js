function show(k) {
  frame = Math.max(0, Math.min(last, k));
  slider.value = frame;
  time.textContent = times[frame].toFixed(1) + " s";
  const path = data.frames.position.slice(0, frame + 1);
  const x = [[], [], []];
  const add = (xs, ys, zs) => { x[0].push(xs); x[1].push(ys); x[2].push(zs); };
  add(path.map(p => p[0]), path.map(p => p[1]), path.map(p => p[2]));
  data.parts.forEach(part => add(...placed(part, frame)));
  if (data.frames.reference) {
    const r = data.frames.reference[frame];
    add([r[0]], [r[1]], [r[2]]);
  }
  Plotly.restyle(scene, { x: x[0], y: x[1], z: x[2] }, data.moving);
  Plotly.relayout(series, { "shapes[0].x0": times[frame], "shapes[0].x1": times[frame] });
}
