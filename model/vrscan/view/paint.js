// Figures are drawn on a canvas, which style sheets do not reach: they take the page's colours from here.
const style = getComputedStyle(document.documentElement)
const dark = matchMedia("(prefers-color-scheme: dark)")
const colour = (name) => style.getPropertyValue(name).trim()
function paint() {
  const ink = colour("--ink"), quiet = colour("--quiet"), line = colour("--line")
  const set = (model, names, value) => { for (const name of names) if (name in model) model[name] = value }
  for (const figure of figures) {
    for (const part of [...figure.left, ...figure.right, ...figure.below, ...figure.center]) {
      set(part, ["axis_label_text_color"], part.tags[0] ?? ink)  // a curve's axis has its colour
      set(part, ["label_text_color"], ink)
      set(part, ["major_label_text_color", "title_text_color"], quiet)
      set(part, ["axis_line_color", "major_tick_line_color", "grid_line_color"], line)
    }
  }
}
paint()
dark.addEventListener("change", paint)
