// Runs before the page's own script: keeps whatever goes wrong.
window.problems = [];
window.addEventListener('error', (event) => problems.push(`error: ${event.message}`));
window.addEventListener('unhandledrejection', (event) => problems.push(`rejection: ${event.reason}`));
console.error = (...words) => problems.push(`console: ${words.join(' ')}`);

const ids = (selector) => [...document.querySelectorAll(selector)].map((node) => node.dataset.id);
const press = (node, key) => node.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true, cancelable: true }));
const type = (input, text) => {
    input.value = text;
    input.dispatchEvent(new Event('input', { bubbles: true }));
};

// Contrast of text with what is behind it (WCAG 2.2), the least over all text shown.
function leastContrast() {
    const parse = (text) => text.match(/[\d.]+/g).map(Number);
    const luminance = (rgb) => rgb.slice(0, 3)
        .map((c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4))
        .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
    const behind = (node) => {
        for (; node; node = node.parentElement) {
            const rgb = parse(getComputedStyle(node).backgroundColor);
            if (rgb.length === 3 || rgb[3] === 1) return rgb;
        }
        return [255, 255, 255];
    };
    const ratios = [...document.body.querySelectorAll('*')]
        .filter((node) => !node.closest('svg') && node.checkVisibility() && [...node.childNodes].some((n) => n.nodeType === 3 && n.data.trim()))
        .map((node) => [luminance(parse(getComputedStyle(node).color)), luminance(behind(node))].sort((a, b) => b - a))
        .map(([light, dark]) => (light + 0.05) / (dark + 0.05));
    return { texts: ratios.length, least: Math.min(...ratios) };
}

// Runs after the page's: `act` returns what the test wants to know.
async function report(act) {
    let result = null;
    try {
        result = await act();
    } catch (error) {
        problems.push(`test: ${error.stack}`);
    }
    const pre = document.createElement('pre');
    pre.id = 'result';
    pre.textContent = encodeURIComponent(JSON.stringify({ problems, result }));
    document.body.append(pre);
}
