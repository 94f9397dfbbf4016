// The search runs in a worker, which browsers refuse to a page opened from disk: there a hidden
// frame takes its place.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(script) {
      super();
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      this.begun = new Promise((resolve) => {
        this.frame.addEventListener("load", resolve);
      });
      // Without the first script the second would send its answers to itself.
      const element = `<script src="${new URL(script, document.baseURI)}"></` + "script>";
      this.frame.srcdoc =
        "<script>postMessage = (data) => frameElement.answered(data)</" + `script>${element}`;
      this.frame.answered = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
      (document.body ?? document.documentElement).append(this.frame);
    }

    async postMessage(data) {
      await this.begun;
      this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data }));
    }

    terminate() {
      this.frame.remove();
    }
  };
}
