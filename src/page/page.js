'use strict';
const data = JSON.parse(document.getElementById('data').textContent);
const $ = (id) => document.getElementById(id);

/** Sets attributes (false and null: none) and `on`'s listeners, and appends children: text, never markup. */
function fill(element, { on = {}, ...attributes }, children) {
    for (const [name, value] of Object.entries(attributes)) {
        if (value !== false && value != null) element.setAttribute(name, value === true ? '' : value);
    }
    for (const [event, listener] of Object.entries(on)) element.addEventListener(event, listener);
    element.append(...children.flat(Infinity).filter((child) => child != null));
    return element;
}

const el = (tag, attributes = {}, ...children) => fill(document.createElement(tag), attributes, children);

/** A picture by its key; a note where none was kept. */
function picture(key, alt) {
    const src = data.images?.[key];
    return src ? el('img', { src, alt }) : el('p', { class: 'soft' }, 'no picture');
}

/** A button that shows or hides: `shown` is its state now, `change` hears of the next. */
function toggle(shown, change, ...content) {
    return el('button', { class: 'toggle', 'aria-pressed': String(shown), on: { click: () => change(!shown) } }, ...content);
}

const superscript = (n) => String(n).replace(/./g, (c) => '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'['-0123456789'.indexOf(c)]);

/** Three digits. */
function number(x) {
    if (x == null) return '–';
    const size = Math.abs(x);
    if (size === 0) return '0';
    const sign = x < 0 ? '−' : '';
    if (size < 1e-3 || size >= 1e6) {
        const [digits, power] = size.toExponential(2).split('e');
        return `${sign}${digits}×10${superscript(Number(power))}`;
    }
    return sign + (size < 999.5 ? size.toPrecision(3) : Math.round(size).toLocaleString('en').replace(/,/g, '\u202f'));
}
