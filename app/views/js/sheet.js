// A picture to work on: zoomed with the wheel, moved with the right button; handles are dragged, empty places clicked.
// Everything is in pixels of the depth image, whose centres have whole coordinates.

const SVG = 'http://www.w3.org/2000/svg';
const RADIUS = 7, LEAST = 12;  // of a handle on the screen; pixels of the depth image across at the closest
const PATIENCE = 400;  // ms after which a lost answer is no longer waited for

const made = (name, attributes, parent) => {
  const node = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (parent) parent.append(node);
  return node;
};

export function render({ model }) {
  const root = document.createElement('div');
  root.className = 'sheet';
  root.tabIndex = 0;
  root.setAttribute('role', 'application');
  const svg = made('svg', { preserveAspectRatio: 'xMidYMid meet' });
  const photo = made('image', { preserveAspectRatio: 'none' }, svg);
  const tint = made('image', { preserveAspectRatio: 'none' }, svg);
  const drawn = made('g', {}, svg);
  const hint = document.createElement('div');
  hint.className = 'hint';
  root.append(svg, hint);

  let box = null, size = '', drag = null, moved = null, waiting = false, timer = null, scheduled = false;
  const urls = {};

  const whole = () => [-0.5, -0.5, model.size[0], model.size[1]];
  const scale = () => {  // pixels of the depth image for one of the screen
    const frame = svg.getBoundingClientRect();
    return 1 / Math.min(frame.width / box[2], frame.height / box[3]);
  };
  const at = (event) => {
    const frame = svg.getBoundingClientRect(), per = scale();
    return [
      box[0] + box[2] / 2 + (event.clientX - frame.left - frame.width / 2) * per,
      box[1] + box[3] / 2 + (event.clientY - frame.top - frame.height / 2) * per,
    ];
  };

  const show = (node, key, bytes, [x, y, width, height]) => {
    const old = urls[key];
    if (!bytes || !bytes.byteLength) {
      node.style.display = 'none';
    } else {
      urls[key] = URL.createObjectURL(new Blob([bytes]));
      node.style.display = '';
      for (const [name, value] of Object.entries({ x, y, width, height, href: urls[key] })) node.setAttribute(name, value);
    }
    if (old && old !== urls[key]) setTimeout(() => URL.revokeObjectURL(old), 1000);
  };

  const handle = (item, per) => {
    const own = drag && drag.handle === item.name && moved ? moved : [item.u, item.v];
    const group = made('g', { class: `handle ${item.kind} ${item.name === model.chosen ? 'chosen' : ''}` }, drawn);
    group.dataset.name = item.name;
    made('circle', { cx: own[0], cy: own[1], r: RADIUS * per * (item.kind === 'mark' || item.kind === 'suggested' ? 0.75 : 1) }, group);
    const words = made('text', {
      x: 0, y: 0, class: item.quiet ? 'quiet' : '', transform: `translate(${own[0] + 10 * per} ${own[1] + 4 * per}) scale(${per})`,
    }, group);
    words.textContent = item.label;
    group.addEventListener('pointerdown', (event) => {
      if (event.button !== 0 || event.shiftKey) return;
      event.stopPropagation();
      event.preventDefault();
      root.focus();
      drag = { handle: item.name, start: at(event), from: [item.u, item.v] };
      moved = null;
      svg.setPointerCapture(event.pointerId);
      model.send_msg({ kind: 'begin', handle: item.name, start: drag.start, at: drag.start });
    });
  };

  const draw = () => {
    scheduled = false;
    const now = model.size.join();
    if (now !== size) { size = now; box = model.focus.length ? [...model.focus] : whole(); }
    if (!model.size[0]) return;
    const per = scale();
    if (!Number.isFinite(per)) return;  // it is not seen now
    svg.setAttribute('viewBox', box.join(' '));
    root.classList.toggle('places', model.places);
    root.setAttribute('aria-label', model.alt);
    hint.textContent = model.hint;
    hint.style.display = model.hint ? 'flex' : 'none';
    drawn.replaceChildren();
    for (const line of model.lines) {
      const points = line.points.map((pair) => pair.join()).join(' ');
      if (line.kind !== 'before') made('polyline', { points, class: 'under' }, drawn);
      made('polyline', { points, class: line.kind }, drawn);
    }
    for (const item of model.handles) handle(item, per);
    root.dataset.drawn = String(Number(root.dataset.drawn || 0) + 1);
    root.dataset.box = box.join(' ');
  };
  const soon = () => { if (!scheduled) { scheduled = true; requestAnimationFrame(draw); } };

  // While a drag is answered, movements wait; the newest is sent then.
  const send = () => {
    if (waiting || !drag || !moved) return;
    waiting = true;
    timer = setTimeout(answered, PATIENCE);
    drag.sent = drag.last;
    model.send_msg({ kind: 'move', handle: drag.handle, start: drag.start, at: drag.last });
  };
  const answered = () => {
    clearTimeout(timer);
    waiting = false;
    if (drag && drag.sent !== drag.last) send();
    soon();
  };

  svg.addEventListener('pointerdown', (event) => {
    root.focus();
    if (!box) return;
    if (event.button === 0 && !event.shiftKey) {
      if (model.places) model.send_msg({ kind: 'place', at: at(event) });
      return;
    }
    event.preventDefault();
    drag = { pan: [event.clientX, event.clientY], box: [...box] };
    svg.setPointerCapture(event.pointerId);
    root.classList.add('pans');
  });
  svg.addEventListener('pointermove', (event) => {
    if (!drag) return;
    if (drag.pan) {
      const per = scale();
      box[0] = drag.box[0] - (event.clientX - drag.pan[0]) * per;
      box[1] = drag.box[1] - (event.clientY - drag.pan[1]) * per;
      soon();
      return;
    }
    drag.last = at(event);
    moved = [drag.from[0] + drag.last[0] - drag.start[0], drag.from[1] + drag.last[1] - drag.start[1]];
    soon();
    send();
  });
  const end = () => {
    if (!drag) return;
    root.classList.remove('pans');
    if (!drag.pan) model.send_msg({ kind: 'end', handle: drag.handle, start: drag.start, at: drag.last ?? drag.start });
    drag = null; moved = null;
    soon();
  };
  svg.addEventListener('pointerup', end);
  svg.addEventListener('pointercancel', end);
  svg.addEventListener('contextmenu', (event) => event.preventDefault());
  svg.addEventListener('dblclick', () => { if (!model.places) { box = whole(); soon(); } });
  svg.addEventListener('wheel', (event) => {
    event.preventDefault();
    const turn = event.deltaY || event.deltaX;
    if (event.shiftKey) { model.send_msg({ kind: 'push', steps: Math.sign(turn) }); return; }
    const [u, v] = at(event), [, , width, height] = whole();
    const factor = Math.min(Math.max(Math.exp(turn * 0.0015), LEAST / box[2]), Math.max(width / box[2], 1));
    box = [u + (box[0] - u) * factor, v + (box[1] - v) * factor, box[2] * factor, box[3] * factor];
    if (box[2] >= width - 1e-6) box = [-0.5, -0.5, width, height];
    soon();
  }, { passive: false });
  root.addEventListener('keydown', (event) => {
    if (event.ctrlKey && event.key === 'z') {
      model.send_msg({ kind: 'undo' });
    } else if (event.ctrlKey || event.metaKey || event.altKey) {
      return;
    } else if (event.key === '0') {
      box = whole();
      soon();
    } else if (model.keys.includes(event.key)) {
      model.send_msg({ kind: 'key', key: event.key, shift: event.shiftKey });
    } else {
      return;
    }
    event.preventDefault();
    event.stopPropagation();  // the time line knows some of these keys too
  });

  const picture = () => { show(photo, 'photo', model.image, whole()); soon(); };
  const coloured = () => show(tint, 'tint', model.tint, model.tint_box.length ? model.tint_box : whole());
  model.on('image', picture);
  model.on('tint', coloured);
  const focus = () => { if (model.focus.length) box = [...model.focus]; soon(); };
  model.on('focus', focus);
  model.on('echo', answered);
  for (const name of ['size', 'lines', 'handles', 'chosen', 'hint', 'alt', 'places']) model.on(name, soon);
  const watcher = new ResizeObserver(soon);
  watcher.observe(root);
  model.on('remove', () => {
    watcher.disconnect();
    for (const url of Object.values(urls)) URL.revokeObjectURL(url);
  });
  box = whole();
  size = model.size.join();
  focus();
  picture();
  coloured();
  return root;
}
