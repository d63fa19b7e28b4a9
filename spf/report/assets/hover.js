// A pointer over one plot shows the same frame in all of them; the arrow keys do when a plot has the focus.
(() => {
  const plots = [...document.querySelectorAll('[data-hover]')].map((figure) => {
    const data = JSON.parse(figure.dataset.hover);
    return { data, canvas: figure.querySelector('.canvas'), cursor: figure.querySelector('.cursor'), out: figure.querySelector('.values') };
  });
  let shown = 0;
  const show = (row) => {
    shown = row;
    for (const { data, cursor, out } of plots) {
      const frame = data.frames[row];
      if (frame === undefined) continue;
      const share = (frame - data.low) / (data.high - data.low);
      cursor.hidden = false;
      cursor.style.left = `${100 * (data.left + share * (data.right - data.left))}%`;
      cursor.style.top = `${100 * data.top}%`;
      cursor.style.height = `${100 * (data.bottom - data.top)}%`;
      const values = data.lines.map(({ name, values }) => `${name} ${values[row] ?? '–'}`);
      out.textContent = `frame ${frame}:  ${values.join('  ·  ')}`;
    }
  };
  for (const { data, canvas } of plots) {
    const last = data.frames.length - 1;
    canvas.tabIndex = 0;
    canvas.setAttribute('role', 'group');
    canvas.setAttribute('aria-label', 'Plot: arrow keys show the values of a frame');
    canvas.addEventListener('pointermove', (event) => {
      const box = canvas.getBoundingClientRect();
      const share = ((event.clientX - box.left) / box.width - data.left) / (data.right - data.left);
      const frame = data.low + share * (data.high - data.low);
      show(Math.min(Math.max(Math.round(frame - data.frames[0]), 0), last));
    });
    canvas.addEventListener('keydown', (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!step) return;
      event.preventDefault();
      show(Math.min(Math.max(shown + step, 0), last));
    });
  }
  addEventListener('beforeprint', () => document.querySelectorAll('details').forEach((part) => { part.open = true; }));
})();
