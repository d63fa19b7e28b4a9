// The time line: a row of buttons, a chart of one quantity over all frames, and a bar that says what was tracked.
// It draws what the model says, and sends what the visitor wants: {kind, ...}. Nothing is decided here.

const BUTTONS = [
  ['first', 'First frame', 'Home', 'M6 6h2v12H6zM20 6v12l-10-6z'],
  ['back', 'Back', '←', 'M15 6v12l-9-6z'],
  ['play', 'Play', 'Space', 'M8 5v14l11-7z'],
  ['step', 'Step', '→', 'M9 6v12l9-6z'],
  ['last', 'Last tracked frame', 'End', 'M16 6h2v12h-2zM4 6v12l10-6z'],
  ['worst', 'Worst frame', 'W', 'M3 17l5-6 4 3 5-9 2 1-6 12-4-3-4 5z'],
  ['loss', 'Next loss', 'L', 'M12 3L1 21h22zM11 10h2v5h-2zM11 17h2v2h-2z'],
  ['start', 'Range starts here', 'I', 'M10 4H6v16h4v-2H8V6h2zM12 11h8v2h-8z'],
  ['end', 'Range ends here', 'O', 'M14 4h4v16h-4v-2h2V6h-2zM4 11h8v2H4z'],
  ['loop', 'Loop', 'P', 'M12 5V1L7 6l5 5V7a5 5 0 0 1 0 10H7v2h5a7 7 0 0 0 0-14z'],
  ['restart', 'Restart', '', 'M12 5a7 7 0 1 0 7 7h-2a5 5 0 1 1-5-5v4l5-5-5-5z'],
  ['reach', 'Track to here', 'T', 'M4 11h9V7l7 5-7 5v-4H4zM20 5h2v14h-2z'],
];
const PAUSE = 'M6 5h4v14H6zM14 5h4v14h-4z';
const KEYS = [
  ['Space', 'play, pause'], ['← →', 'one frame back or forward; after the last tracked one, → tracks the next'],
  ['Shift ← →', 'ten frames'], ['Home, End', 'first frame, last tracked frame'], ['W', 'worst frame'],
  ['L', 'next loss'], ['I, O', 'the range that is played starts, ends here'], ['Esc', 'no range'],
  ['P', 'loop on, off'], ['T', 'track to the frame shown'], ['?', 'this list'],
];
const LEFT = 40, RIGHT = 12, CHART = 44, AXIS = 17, GAP = 3;
const LOST = '#c62828', FOUND = '#2e9e4f';

export function render({ model, el }) {
  const root = document.createElement('div');
  root.className = 'line';
  const bar = document.createElement('div');
  bar.className = 'bar';
  const send = (kind, more = {}) => model.send_msg({ kind, ...more });

  const buttons = {};
  for (const [kind, name, key, path] of BUTTONS) {
    const button = document.createElement('button');
    button.type = 'button';
    button.innerHTML = `<svg viewBox="0 0 24 24" aria-hidden="true"><path d="${path}"/></svg>`;
    button.setAttribute('aria-label', name);
    button.title = key ? `${name} (${key})` : name;
    button.addEventListener('click', () => send(kind));
    buttons[kind] = button;
    bar.append(button);
  }
  const words = (button, text) => { button.append(Object.assign(document.createElement('span'), { textContent: text })); };
  words(buttons.play, 'Play'); words(buttons.step, 'Step');
  buttons.play.classList.add('main');

  const speed = document.createElement('select');
  speed.setAttribute('aria-label', 'Speed of play');
  speed.title = 'Speed at which tracked frames are played';
  for (const [value, text] of [[0, 'every frame'], [0.25, '¼ ×'], [0.5, '½ ×'], [1, '1 ×'], [2, '2 ×'], [4, '4 ×']]) {
    speed.append(new Option(text, value));
  }
  speed.addEventListener('change', () => send('speed', { value: Number(speed.value) }));
  const help = document.createElement('button');
  help.type = 'button'; help.textContent = '?'; help.title = 'Keys (?)';
  help.setAttribute('aria-label', 'Keys');
  help.addEventListener('click', () => toggleKeys());
  const readout = document.createElement('div');
  readout.className = 'readout';
  bar.append(speed, help, readout);

  const keys = document.createElement('div');
  keys.className = 'keys'; keys.hidden = true;
  keys.setAttribute('role', 'dialog'); keys.setAttribute('aria-label', 'List of keys');
  keys.innerHTML = '<table>' + KEYS.map(([k, t]) => `<tr><th scope="row">${k}</th><td>${t}</td></tr>`).join('') +
    '</table><p>Drag to scrub; drag with Shift to choose the range that is played.</p>';
  const toggleKeys = () => { keys.hidden = !keys.hidden; help.setAttribute('aria-expanded', String(!keys.hidden)); };

  const track = document.createElement('div');
  track.className = 'track'; track.tabIndex = 0;
  track.setAttribute('role', 'slider'); track.setAttribute('aria-label', 'Frame');
  const canvas = document.createElement('canvas');
  const tip = document.createElement('div');
  tip.className = 'tip'; tip.hidden = true;
  track.append(canvas, tip);
  root.append(bar, keys, track);

  // ---- where is what
  const width = () => Math.max(canvas.clientWidth - LEFT - RIGHT, 1);
  const x = (frame) => LEFT + (frame + 0.5) / Math.max(model.count, 1) * width();
  const frameAt = (px) => Math.min(Math.max(Math.floor((px - LEFT) / width() * model.count), 0), Math.max(model.count - 1, 0));
  const rowHeight = () => model.lanes.length > 1 ? 6 : 10;

  // ---- drawing
  let head = model.frame, dragged = null, queued = false;
  const draw = () => { if (!queued) { queued = true; requestAnimationFrame(paint); } };
  const paint = () => {
    queued = false;
    const ink = getComputedStyle(root).color, ratio = window.devicePixelRatio || 1;
    const w = canvas.clientWidth, rows = Math.max(model.lanes.length, 1), h = CHART + GAP + rows * (rowHeight() + 2) + AXIS;
    if (!w) return;
    canvas.style.height = `${h}px`;
    canvas.width = Math.round(w * ratio); canvas.height = Math.round(h * ratio);
    const c = canvas.getContext('2d');
    if (!model.count) return;  // no session
    c.scale(ratio, ratio); c.font = '11px Roboto, sans-serif'; c.lineJoin = 'round';
    const cell = width() / Math.max(model.count, 1), bars = CHART + GAP;
    const block = (from, to, y, height, colour, least = 1) =>
      { c.fillStyle = colour; const a = LEFT + from * cell; c.fillRect(a, y, Math.max((to - from + 1) * cell, least), height); };
    const faint = (alpha, f) => { c.globalAlpha = alpha; f(); c.globalAlpha = 1; };
    // chart
    faint(0.06, () => block(0, model.count - 1, 0, CHART, ink));
    const top = model.top || 1, y = (v) => CHART - 2 - Math.min(v / top, 1) * (CHART - 6);
    for (const lane of model.lanes) {
      for (const [a, b] of lane.lost) faint(model.lanes.length > 1 ? 0.12 : 0.22, () => block(a, b, 0, CHART, LOST, 2));
      c.strokeStyle = c.fillStyle = model.lanes.length > 1 ? lane.colour : ink; c.lineWidth = 1.4; c.beginPath();
      let on = false;
      lane.values.forEach((v, i) => {
        if (v === null) { on = false; return; }
        const px = x(lane.first + i), py = y(v);
        if (on) c.lineTo(px, py); else { c.moveTo(px, py); c.lineTo(px + 0.01, py); on = true; }
      });
      c.lineCap = 'round'; c.stroke();
    }
    c.fillStyle = ink; c.textAlign = 'right'; c.textBaseline = 'top';
    faint(0.8, () => { c.fillText(model.top ? String(model.top) : '', LEFT - 5, 0); c.textBaseline = 'bottom'; c.fillText('0', LEFT - 5, CHART); });
    // what was tracked
    (model.lanes.length ? model.lanes : [null]).forEach((lane, i) => {
      const at = bars + i * (rowHeight() + 2);
      faint(0.14, () => block(0, model.count - 1, at, rowHeight(), ink));
      if (!lane) return;
      for (const [a, b] of lane.tracked) block(a, b, at, rowHeight(), lane.colour, 2);
      for (const [a, b] of lane.lost) block(a, b, at, rowHeight(), LOST, 3);
      for (const [a, b] of lane.found) block(a, b, at, rowHeight(), FOUND, 3);
    });
    // axis
    const below = bars + rows * (rowHeight() + 2), every = step(model.count, width());
    c.textAlign = 'center'; c.textBaseline = 'top'; c.fillStyle = ink;
    for (let f = 0; f < model.count; f += every) faint(0.8, () => { c.fillRect(x(f), below, 1, 3); c.fillText(String(f), x(f), below + 4); });
    // range that is played, and where we are
    if (model.span.length) {
      const [a, b] = model.span;
      faint(0.16, () => { c.fillStyle = ink; c.fillRect(LEFT, 0, a * cell, below); c.fillRect(LEFT + (b + 1) * cell, 0, width() - (b + 1) * cell, below); });
      c.fillStyle = ink; c.fillRect(LEFT + a * cell - 1, 0, 2, below); c.fillRect(LEFT + (b + 1) * cell - 1, 0, 2, below);
    }
    const px = x(dragged ?? head);
    c.fillStyle = getComputedStyle(root).getPropertyValue('--head').trim() || ink;
    c.fillRect(px - 1, 0, 2, below);
    c.beginPath(); c.moveTo(px - 6, 0); c.lineTo(px + 6, 0); c.lineTo(px, 8); c.fill();
  };
  const step = (count, room) => {
    const least = count / Math.max(room / 55, 1);
    for (let unit = 1; ; unit *= 10) for (const m of [1, 2, 5]) if (m * unit >= least) return m * unit;
  };

  // ---- what the model says
  const follow = () => {
    head = model.frame;
    track.setAttribute('aria-valuemin', 0); track.setAttribute('aria-valuemax', Math.max(model.count - 1, 0));
    track.setAttribute('aria-valuenow', head); track.setAttribute('aria-valuetext', `Frame ${head}`);
    readout.innerHTML = model.readout;
    draw();
  };
  const enable = () => {
    for (const [kind] of BUTTONS) buttons[kind].disabled = !model.can.includes(kind);
    buttons.reach.style.display = model.can.includes('reach') ? '' : 'none';
    const play = buttons.play, name = model.playing ? 'Pause' : 'Play';
    play.setAttribute('aria-label', name); play.querySelector('span').textContent = name; play.title = `${name} (Space)`;
    play.querySelector('path').setAttribute('d', model.playing ? PAUSE : BUTTONS[2][3]);
    buttons.loop.setAttribute('aria-pressed', String(model.loop));
    speed.value = String(model.speed);
  };
  model.on('frame', () => { waiting = false; follow(); flush(); });
  model.on('readout', follow); model.on('count', follow);
  for (const name of ['lanes', 'top', 'span', 'dark']) model.on(name, () => setTimeout(draw, name === 'dark' ? 120 : 0));
  for (const name of ['can', 'playing', 'loop', 'speed']) model.on(name, enable);
  follow(); enable();

  // ---- scrubbing: the newest wins, one frame in flight
  let waiting = false, wanted = null, timer = null;
  const flush = () => {
    if (waiting || wanted === null) return;
    const frame = wanted; wanted = null;
    if (frame === model.frame) return;
    waiting = true; clearTimeout(timer); timer = setTimeout(() => { waiting = false; flush(); }, 400);
    send('look', { frame });
  };
  let from = null;
  track.addEventListener('pointerdown', (e) => {
    if (e.button !== 0 || !model.count) return;
    track.setPointerCapture(e.pointerId);
    from = e.shiftKey ? frameAt(e.offsetX) : null;
    drag(e);
  });
  const drag = (e) => {
    const frame = frameAt(e.clientX - canvas.getBoundingClientRect().left);
    if (from !== null) { send('span', { start: Math.min(from, frame), end: Math.max(from, frame) }); return; }
    dragged = wanted = frame; draw(); flush();
  };
  track.addEventListener('pointermove', (e) => {
    const frame = frameAt(e.clientX - canvas.getBoundingClientRect().left);
    tip.hidden = !model.count; tip.textContent = said(frame);
    tip.style.left = `${Math.min(Math.max(x(frame), 60), canvas.clientWidth - 90)}px`;
    if (track.hasPointerCapture(e.pointerId)) drag(e);
  });
  const drop = () => { from = null; dragged = null; draw(); };
  track.addEventListener('lostpointercapture', drop);
  track.addEventListener('pointerleave', () => { tip.hidden = true; });
  const said = (frame) => {
    const parts = [`frame ${frame}`];
    for (const lane of model.lanes) {
      const within = (ranges) => ranges.some(([a, b]) => a <= frame && frame <= b), v = lane.values[frame - lane.first];
      if (within(lane.lost)) parts.push('lost');
      else if (v !== undefined && v !== null) parts.push(`${v} ${model.unit}${within(lane.found) ? ', found again' : ''}`);
    }
    return parts.join(' · ');
  };

  // ---- buttons and keys
  const TYPING = new Set(['INPUT', 'TEXTAREA', 'SELECT']), ROLES = new Set(['slider', 'combobox', 'listbox', 'option', 'radio', 'tab', 'menuitem', 'spinbutton']);
  const onKey = (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey || e.defaultPrevented || !root.isConnected || !root.offsetParent) return;
    const at = e.composedPath()[0], own = at === track;
    if (!own && at.tagName && (TYPING.has(at.tagName) || at.isContentEditable || ROLES.has(at.getAttribute('role')))) return;
    if (e.key === ' ' && at.tagName === 'BUTTON') return;
    const kind = {
      ' ': 'play', Home: 'first', End: 'last', ArrowLeft: 'back', ArrowRight: 'step',
      w: 'worst', l: 'loss', i: 'start', o: 'end', p: 'loop', t: 'reach',
    }[e.key.length === 1 ? e.key.toLowerCase() : e.key];
    if (e.key === '?') toggleKeys();
    else if (e.key === 'Escape') { if (!keys.hidden) toggleKeys(); else if (model.span.length) send('span', {}); else return; }
    else if (e.shiftKey && (e.key === 'ArrowLeft' || e.key === 'ArrowRight')) {
      send('look', { frame: Math.min(Math.max(model.frame + (e.key === 'ArrowLeft' ? -10 : 10), 0), model.count - 1) });
    } else if (kind) send(kind);  // what cannot be done is answered
    else return;
    e.preventDefault();
  };
  document.addEventListener('keydown', onKey);
  model.on('remove', () => { document.removeEventListener('keydown', onKey); watcher.disconnect(); });
  const watcher = new ResizeObserver(draw);
  watcher.observe(root);
  return root;
}
