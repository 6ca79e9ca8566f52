// Filters the page of verdicts and turns over a picture.
const cards = () => [...document.querySelectorAll('#scenes figure')].map((card) => card.id);
const links = () => [...document.querySelectorAll('#matrix a')].map((link) => link.getAttribute('href').slice(1));
const press_key = (key) => document.querySelector(`[data-key="${key}"]`).click();

report(async () => {
    const out = { contrast: leastContrast(), cards: cards(), links: links(), count: document.getElementById('count').innerText };
    out.words = [...document.querySelectorAll('#scenes figure .verdict')].map((verdict) => verdict.innerText);
    out.colours = ['holds', 'fails-as-known', 'fails'].map((verdict) => getComputedStyle(document.querySelector(`#scenes .${verdict}`)).color);
    const show = document.querySelector('.show');
    const src = () => show.querySelector('img').src;
    out.pictures = [src(), (show.click(), src()), (show.click(), src())];
    press_key('holds');
    out.without_holds = { cards: cards(), links: links() };
    press_key('holds');
    press_key('method path');
    out.without_path = { cards: cards(), links: links() };
    return out;
});
