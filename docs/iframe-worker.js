// Browsers start no worker from a file. Where the site is opened without a server, this runs the search in a frame instead.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super()
      this.queue = []
      const frame = document.createElement("iframe")
      frame.hidden = true
      frame.srcdoc = "<script>function importScripts(...urls) {" +
        "return Promise.all(urls.map(url => new Promise((done, failed) => {" +
        "const script = document.createElement('script'); script.src = url; script.onload = done; script.onerror = failed;" +
        "document.head.append(script)})))}</script>"
      frame.onload = () => {
        const inside = frame.contentWindow
        inside.postMessage = data => this.answer(data)
        const script = inside.document.createElement("script")
        script.src = url
        script.onload = () => {
          this.ask = data => inside.dispatchEvent(new inside.MessageEvent("message", { data }))
          this.queue.forEach(this.ask)
        }
        inside.document.head.append(script)
      }
      document.documentElement.append(frame)
    }
    postMessage(data) {
      this.ask ? this.ask(data) : this.queue.push(data)
    }
    answer(data) {
      const event = new MessageEvent("message", { data })
      this.dispatchEvent(event)
      this.onmessage?.(event)
    }
    terminate() {}
  }
}
