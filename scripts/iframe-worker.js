// Search for pages that are opened as files: a browser gives them no Worker, so that the search's script runs in an
// empty frame of the page.  The theme asks for IFrameWorker by its name, and awaits what importScripts returns.
if (location.protocol === "file:") {
  window.IFrameWorker = window.Worker = class extends EventTarget {
    constructor(url) {
      super()
      const frame = document.createElement("iframe")
      frame.hidden = true
      document.body.append(frame)
      const inside = frame.contentWindow
      const load = (source) => new Promise((done, fail) => {
        const script = inside.document.createElement("script")
        Object.assign(script, { src: source, onload: done, onerror: fail })
        inside.document.body.append(script)
      })
      inside.importScripts = (...sources) => sources.reduce((before, each) => before.then(() => load(each)), Promise.resolve())
      inside.postMessage = (data) => this.dispatchEvent(new MessageEvent("message", { data }))
      const loaded = load(url)
      this.postMessage = (data) => loaded.then(() => inside.dispatchEvent(new inside.MessageEvent("message", { data })))
      this.terminate = () => frame.remove()
    }
  }
}
