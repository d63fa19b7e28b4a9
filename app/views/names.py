"""Names for what the widget library leaves without one, so that a screen reader can say what it is."""

from __future__ import annotations

from panel.custom import JSComponent

__all__ = ["Names"]


class Names(JSComponent):
    """Takes no room. Looks through the page whenever it changes, and names progress bars, hints, the buttons of numbers and the
    body of tables.

    Panel's widgets draw these without a role or a name (axe-core: aria-progressbar-name, aria-prohibited-attr, button-name,
    aria-required-children), and have no parameter for it.
    """

    _esm = """
    const RULES = [
      ['[role=progressbar]:not([aria-label])', (it) => it.setAttribute('aria-label', 'Progress')],
      ['span[aria-label]:not([role])', (it) => it.setAttribute('role', 'img')],
      ['.MuiInputAdornment-root button:not([aria-label])', (it) => {
        const label = it.closest('.MuiFormControl-root')?.querySelector('label')?.textContent ?? 'Number';
        const less = it.closest('.MuiInputAdornment-positionStart');
        it.setAttribute('aria-label', `${label.replace('*', '').trim()}: ${less ? 'less' : 'more'}`);
      }],
      ['.tabulator-tableholder:not([role])', (it) => {  // it can be focused, so that it is a part of the grid
        it.setAttribute('role', 'rowgroup');
        it.querySelector('.tabulator-table')?.setAttribute('role', 'presentation');
      }],
    ];

    export function render({ model }) {
      const watched = new WeakSet();
      let waiting = false;
      const soon = () => {
        if (waiting) return;
        waiting = true;
        setTimeout(() => { waiting = false; look(document); }, 300);
      };
      const observer = new MutationObserver(soon);
      const look = (root) => {
        if (!watched.has(root)) {
          watched.add(root);
          observer.observe(root, { childList: true, subtree: true });
        }
        for (const [selector, name] of RULES) root.querySelectorAll(selector).forEach(name);
        for (const it of root.querySelectorAll('*')) if (it.shadowRoot) look(it.shadowRoot);
      };
      look(document);
      model.on('remove', () => observer.disconnect());
      return document.createElement('span');
    }
    """
