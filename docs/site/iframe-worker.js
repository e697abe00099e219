// Lets the search work where pages are opened as files: browsers start no Worker from a file, so a hidden frame takes its
// place. The theme's plugin `offline` would else load a script of this name from the network.
"use strict";

class FrameWorker extends EventTarget {
  constructor(script) {
    super();
    this.frame = document.createElement("iframe");
    this.frame.hidden = true;
    document.body.append(this.frame);
    const inside = this.frame.contentWindow;
    inside.postMessage = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
    inside.importScripts = async (...scripts) => {
      for (const each of scripts) await this.load(each);
    };
    this.isReady = this.load(script);
  }

  load(script) {
    return new Promise((resolve, reject) => {
      const inside = this.frame.contentDocument;
      const element = Object.assign(inside.createElement("script"), { src: script, onload: resolve, onerror: reject });
      inside.body.append(element);
    });
  }

  async postMessage(data) {
    await this.isReady;
    this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data }));
  }

  terminate() {
    this.frame.remove();
  }
}

if (location.protocol === "file:") window.Worker = FrameWorker;
