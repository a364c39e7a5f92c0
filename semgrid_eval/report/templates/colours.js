"use strict";
(() => {
  const PREFIX = "data:image/png;base64,";
  const PALETTE_AT = 41; // after the signature, IHDR and the head of PLTE
  const root = document.documentElement;
  const WORDS = root.dataset.classes ? "Class colours of the set" : "Class colours of the paper";

  const remainders = Uint32Array.from({ length: 256 }, (_, n) => {
    for (let bit = 0; bit < 8; bit++) n = n & 1 ? 0xedb88320 ^ (n >>> 1) : n >>> 1;
    return n;
  });
  const checksum = (bytes) => {
    let sum = ~0;
    for (const byte of bytes) sum = remainders[(sum ^ byte) & 255] ^ (sum >>> 8);
    return ~sum >>> 0;
  };

  const palette = () => {
    const style = getComputedStyle(root), bytes = [];
    for (let colour, i = 0; (colour = style.getPropertyValue(`--class-${i}`).trim()); i++)
      for (const at of [1, 3, 5]) bytes.push(parseInt(colour.slice(at, at + 2), 16));
    return bytes;
  };

  // A picture of classes is known by its palette, which is all that has to change in it.
  const repaint = (picture, old, fresh) => {
    const bytes = Uint8Array.from(atob(picture.src.slice(PREFIX.length)), (letter) => letter.charCodeAt(0));
    if (old.some((value, i) => bytes[PALETTE_AT + i] !== value)) return;
    const view = new DataView(bytes.buffer), end = PALETTE_AT + view.getUint32(PALETTE_AT - 8);
    bytes.set(fresh, PALETTE_AT);
    view.setUint32(end, checksum(bytes.subarray(PALETTE_AT - 4, end)));
    picture.src = PREFIX + btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
  };

  const legend = document.querySelector("#examples .legend");
  if (!legend) return;
  const button = element("button", { type: "button", className: "colours" }, WORDS);
  button.title = "The colours shown first can be told apart by colour-blind readers, too";
  button.setAttribute("aria-pressed", "false");
  button.onclick = () => {
    const old = palette(), paper = root.dataset.colours !== "paper";
    if (paper) root.dataset.colours = "paper";
    else delete root.dataset.colours;
    button.setAttribute("aria-pressed", String(paper));
    const fresh = palette();
    for (const picture of document.images) if (picture.src.startsWith(PREFIX)) repaint(picture, old, fresh);
  };
  legend.before(button);
})();
