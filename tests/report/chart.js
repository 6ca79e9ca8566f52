// Uses the page as a reader would, and notes what it shows.
const shown = () => ({ points: ids('.point'), rows: ids('#table tbody tr'), front: ids('.point.front') });
const readouts = () => Object.fromEntries(['best', 'fastest'].map((which) => [which, [document.querySelector(`#${which} a`)?.getAttribute('href') ?? null, document.getElementById(which).textContent]]));
const picture = () => ({
    shot: document.getElementById('shot').src,
    over: document.getElementById('over').hidden ? null : document.getElementById('over').src,
    clip: getComputedStyle(document.getElementById('over')).clipPath,
});
const selection = () => ({ points: ids('.point.selected'), rows: ids('#table tr.selected'), hash: location.hash, ...picture() });
const node = (id) => document.querySelector(`.point[data-id="${id}"]`);
const choose = (view) => document.querySelector(`#view input[value="${view}"]`).click();
const metric = (key) => {
    const select = document.getElementById('metric');
    select.value = key;
    select.dispatchEvent(new Event('change'));
};

report(async () => {
    const out = { contrast: leastContrast() };
    out.dark = matchMedia('(prefers-color-scheme: dark)').matches;
    out.first = selection();
    out.all = shown();
    out.strangers = document.querySelectorAll('img[src="x"], td script, h1 script').length;
    out.failures = document.querySelector('#failures tbody').innerText;
    out.hollow = [...document.querySelectorAll('.point.unranked')].map((point) => [point.dataset.id, point.querySelector('.mark').style.fill]);

    // A click where the last drawn point is seen.
    const last = [...document.querySelectorAll('.point')].at(-1);
    last.scrollIntoView({ block: 'center' });
    const box = last.querySelector('.mark').getBoundingClientRect();
    document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2).dispatchEvent(new MouseEvent('click', { bubbles: true }));
    out.clicked = { id: last.dataset.id, ...selection() };
    await document.getElementById('shot').decode();

    // Three ways to see the reference in its place.
    out.swap = {};
    press(document.body, 'f');
    out.swap.flipped = picture();
    press(document.body, 'f');
    out.swap.back = picture();
    document.getElementById('stack').click();
    out.swap.tapped = picture();
    choose('error');
    out.swap.error = picture();
    const label = document.querySelector('#view input[value="reference"]').parentElement;
    label.dispatchEvent(new PointerEvent('pointerenter'));
    out.swap.hovered = picture();
    label.dispatchEvent(new PointerEvent('pointerleave'));
    out.swap.left = picture();
    choose('slider');
    type(document.getElementById('slide'), '25');
    out.swap.slider = picture();
    const shot = document.getElementById('shot').getBoundingClientRect();
    document.getElementById('shot').dispatchEvent(new PointerEvent('pointermove', { bubbles: true, clientX: shot.x + shot.width * 0.75, clientY: shot.y + 1 }));
    out.swap.moved = picture();
    choose('picture');

    // Keys alone.
    const start = document.querySelector('.point[tabindex="0"]');
    out.stops = document.querySelectorAll('.point[tabindex="0"]').length;
    start.focus();
    const walk = (key) => (press(document.activeElement, key), document.activeElement.dataset.id);
    out.walk = { home: walk('Home'), right: walk('ArrowRight'), left: walk('ArrowLeft'), left_end: walk('ArrowLeft'), end: walk('End'), up: walk('ArrowUp'), down: walk('ArrowDown') };
    out.tip = document.getElementById('tip').hidden ? null : document.getElementById('tip').innerText;
    press(document.activeElement, 'Enter');
    out.entered = { id: document.activeElement.dataset.id, ...selection() };
    press(document.activeElement, 'Escape');
    out.escaped = selection();
    const row = document.querySelector('#table tbody tr:nth-child(3)');
    row.click();
    out.row = { id: row.dataset.id, ...selection() };

    out.sorted = {};
    for (const column of ['ms', 'label', 'general', 'metric bias']) {
        const press = () => document.querySelector(`#table [data-column="${column}"]`).click();
        const read = () => ({ rows: ids('#table tbody tr'), sort: document.querySelector('#table th[aria-sort]').getAttribute('aria-sort') });
        if (column === 'ms') document.querySelector('#table [data-column="rays"]').click();
        press();
        const up = read();
        press();
        out.sorted[column] = { up, down: read() };
    }

    out.time = {};
    for (const ms of ['1', '5', '16', '33', '100']) {
        type(document.getElementById('time'), ms);
        out.time[ms] = readouts().best;
    }
    out.error = {};
    for (const error of ['0.0001', '0.002', '0.02', '0.1']) {
        type(document.getElementById('error'), error);
        out.error[error] = readouts().fastest;
    }
    type(document.getElementById('time'), '16');
    const line = document.getElementById('time-line');
    const value = () => Number(line.getAttribute('aria-valuenow'));
    press(line, 'ArrowRight');
    out.stepped = value();
    const axis = document.getElementById('chart').getBoundingClientRect();
    line.dispatchEvent(new PointerEvent('pointerdown', { bubbles: true }));
    window.dispatchEvent(new PointerEvent('pointermove', { clientX: axis.right, clientY: axis.top }));
    out.dragged = value();
    window.dispatchEvent(new PointerEvent('pointerup'));
    window.dispatchEvent(new PointerEvent('pointermove', { clientX: axis.left, clientY: axis.top }));
    out.dropped = value();

    out.fronts = {};
    for (const option of document.querySelectorAll('#metric option')) {
        metric(option.value);
        out.fronts[option.value] = { ...shown(), gallery: document.querySelectorAll('#front figure').length };
    }
    metric('rel_mse');

    const method = (word) => [...document.querySelectorAll('#methods button')].find((button) => button.textContent === word);
    method('path').click();
    out.without_path = { ...shown(), pressed: method('path').getAttribute('aria-pressed') };
    document.querySelector('input[data-setting="indirect.downsample"][value="4"]').click();
    out.without_path_and_4 = shown();
    method('path').click();
    document.querySelector('input[data-setting="indirect.downsample"][value="4"]').click();
    out.restored = shown();
    return out;
});
