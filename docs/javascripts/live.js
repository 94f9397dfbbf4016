// The live page on the home page is light or dark like the site. From disk it follows the system:
// there a page may not look into another.
{
  const frame = document.querySelector("iframe.live");
  const follow = () => {
    const live = frame.contentDocument?.documentElement;
    const isDark = document.body.dataset.mdColorScheme === "slate";
    if (live && (getComputedStyle(live).colorScheme === "dark") !== isDark) {
      live.querySelector("#theme")?.click();
    }
  };
  if (frame) {
    frame.addEventListener("load", follow);
    new MutationObserver(follow).observe(document.body, {
      attributeFilter: ["data-md-color-scheme"],
    });
  }
}
