"use strict";
// Moves the rings, the dots and the captions of the page to the step that the slider says.
(() => {
  const { figure, rings } = JSON.parse(document.getElementById("data").textContent);
  const stage = document.getElementById("stage");
  const slider = document.getElementById("step");
  const button = document.getElementById("play");

  const unpack = (text, Kind) => {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    return new Kind(bytes.buffer);
  };
  for (const ring of rings) {
    ring.positions = unpack(ring.positions, Float32Array);
    ring.grips = unpack(ring.grips, Float32Array);
    ring.density = unpack(ring.density, Float32Array);
    for (const name of ["gamma", "moment", "energy"]) ring[name] = unpack(ring[name], Float64Array);
  }
  const steps = rings[0].gamma.length;

  // A ribbon has four corners a section, each once for either of its two faces.
  const ribbon = (ring, step) => {
    const n = ring.sections;
    const out = { x: new Float32Array(8 * n), y: new Float32Array(8 * n), z: new Float32Array(8 * n),
                  intensity: new Float32Array(8 * n) };
    for (let v = 0; v < 8 * n; v++) {
      const at = 3 * (4 * n * step + (v >> 1));
      out.x[v] = ring.positions[at];
      out.y[v] = ring.positions[at + 1];
      out.z[v] = ring.positions[at + 2];
      out.intensity[v] = ring.density[n * step + (v >> 3)];
    }
    return out;
  };

  // Two lines, one for each grip; a gap of null between them.
  const arrows = (ring, step) => {
    const out = { x: [], y: [], z: [] };
    for (let p = 0; p < 2 * ring.arc; p++) {
      const at = 3 * (2 * ring.arc * step + p);
      if (p === ring.arc) for (const axis of "xyz") out[axis].push(null);
      out.x.push(ring.grips[at]);
      out.y.push(ring.grips[at + 1]);
      out.z.push(ring.grips[at + 2]);
    }
    return out;
  };

  const captions = rings.map((ring) => {
    const box = document.createElement("div");
    box.className = "ring";
    box.innerHTML = "<b></b><span class=numbers></span><span class=stability></span><span class=event></span>";
    box.querySelector("b").textContent = ring.name;
    box.querySelector("b").style.color = ring.colour;
    document.getElementById("captions").append(box);
    return box;
  });

  let drawing = null;
  let wanted = 0;
  const draw = async () => {
    const step = wanted;
    const shapes = rings.map((ring) => ribbon(ring, step));
    const turned = rings.map((ring) => arrows(ring, step));
    const pick = (of, name) => of.map((one) => one[name]);
    const dots = { x: [], y: [] };
    for (const name of ["moment", "energy"]) {
      for (const ring of rings) {
        dots.x.push([ring.gamma[step]]);
        dots.y.push([Number.isNaN(ring[name][step]) ? null : ring[name][step]]);
      }
    }
    rings.forEach((ring, k) => {
      const said = (name) => captions[k].querySelector("." + name);
      said("numbers").textContent = ring.numbers[step];
      said("stability").textContent = ring.stability[step];
      said("stability").dataset.stable = ring.stable[step];
      said("event").textContent = ring.events[step] && "last: " + ring.events[step];
    });
    const all = (of) => ({ x: pick(of, "x"), y: pick(of, "y"), z: pick(of, "z") });
    const n = rings.length;
    const from = (start, count) => Array.from({ length: count }, (_, k) => start + k);
    await Plotly.restyle(stage, { ...all(shapes), intensity: pick(shapes, "intensity") }, from(0, n));
    await Plotly.restyle(stage, all(turned), from(n, n));
    await Plotly.restyle(stage, dots, from(figure.data.length - 2 * n, 2 * n));
    stage.dataset.step = step;
  };
  // One drawing at a time; of the steps asked for meanwhile the last one counts.
  const show = (step) => {
    wanted = Math.max(0, Math.min(steps - 1, step));
    slider.value = wanted;
    if (drawing === null) {
      const again = () => (Number(stage.dataset.step) === wanted ? null : draw().then(again));
      drawing = draw().then(again).finally(() => { drawing = null; });
    }
    return drawing;
  };

  let playing = null;
  const stop = () => {
    clearInterval(playing);
    playing = null;
    button.textContent = "▶ play";
  };
  const play = () => {
    if (wanted === steps - 1) show(0);
    button.textContent = "❚❚ pause";
    playing = setInterval(() => {
      if (drawing !== null) return;
      if (wanted === steps - 1) stop();
      else show(wanted + 1);
    }, 1000 / 20);
  };
  const toggle = () => (playing === null ? play() : stop());
  const marks = [...new Set(rings.flatMap((ring) => ring.marks))].sort((a, b) => a - b);

  slider.max = steps - 1;
  const ticks = document.getElementById("marks");
  for (const mark of marks) ticks.append(new Option("", mark));
  slider.addEventListener("input", () => { stop(); show(Number(slider.value)); });
  button.addEventListener("click", toggle);
  document.getElementById("before").addEventListener("click", () => {
    stop(); show(marks.filter((m) => m < wanted).pop() ?? 0);
  });
  document.getElementById("after").addEventListener("click", () => {
    stop(); show(marks.find((m) => m > wanted) ?? steps - 1);
  });
  document.addEventListener("keydown", (event) => {
    if (event.target === slider && event.key.startsWith("Arrow")) return;
    if (event.key === " ") { event.preventDefault(); toggle(); }
    if (event.key === "ArrowRight") { stop(); show(wanted + 1); }
    if (event.key === "ArrowLeft") { stop(); show(wanted - 1); }
  });

  const size = () => ({ width: stage.clientWidth, height: stage.clientHeight });
  const layout = { ...figure.layout, ...size() };
  window.ready = Plotly.newPlot(stage, figure.data, layout, { displayModeBar: false })
    .then(() => show(0))
    .then(() => new ResizeObserver(() => Plotly.relayout(stage, size())).observe(stage));
  window.show = show;
})();
