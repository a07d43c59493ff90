// The page answers each beat of the server once it has drawn; until then nothing new is sent.
// Figures are drawn on a canvas, which style sheets do not reach: they take the page's colours from here.
const style = getComputedStyle(document.documentElement)
const dark = matchMedia("(prefers-color-scheme: dark)")
const colour = (name) => style.getPropertyValue(name).trim()
function paint(figures) {
  const ink = colour("--ink"), quiet = colour("--quiet"), line = colour("--line")
  const set = (model, names, value) => { for (const name of names) if (name in model) model[name] = value }
  for (const figure of figures) {
    const parts = [figure.left, figure.right, figure.above, figure.below, figure.center].flatMap((each) => [...each])
    for (const part of [figure.title, ...parts]) {
      set(part, ["axis_label_text_color"], part.tags[0] ?? ink)  // a curve's axis has its colour
      set(part, ["label_text_color"], ink)
      set(part, ["major_label_text_color", "title_text_color", "text_color"], quiet)
      set(part, ["axis_line_color", "major_tick_line_color", "grid_line_color"], line)
    }
  }
}
const opening = setInterval(() => {
  const shown = window.Bokeh?.documents[0]
  const profile = shown?.get_model_by_name("profile")
  if (!profile) return
  clearInterval(opening)
  const figures = shown.roots().filter((each) => each.type == "Figure")
  paint(figures)
  dark.addEventListener("change", () => paint(figures))
  const beat = profile.extra_x_ranges.get?.("beat") ?? profile.extra_x_ranges.beat
  const answer = () => { beat.end = beat.start }
  beat.properties.start.change.connect(answer)
  answer()
}, 50)
