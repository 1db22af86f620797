// SPDX-License-Identifier: GPL-3.0-or-later
// A job type of Flamenco: capture every clip of a folder, one task per clip, with Blender's extension Scope on the workers.
// Copy it into the folder "scripts" beside Flamenco Manager; see docs/cluster.md.

const SUFFIXES = "mp4 mov m4v avi mkv webm mpg mpeg wmv mts m2ts ts 3gp gif jpg jpeg png webp tif tiff bmp avif heic heif";

const JOB_TYPE = {
    label: "Scope: capture clips",
    description: "Markerless motion capture of the videos and images in a folder",
    settings: [
        { key: "folder", type: "string", subtype: "dir_path", required: true, visible: "submission",
          description: "Folder with the footage, which all workers see" },
        { key: "out", type: "string", subtype: "dir_path", required: true, visible: "submission",
          description: "Existing folder for the results, which all workers see" },
        { key: "formats", type: "string", default: "npz,glb", required: true,
          description: "Formats to write for every clip, separated by commas" },
        { key: "quality", type: "string", default: "best", choices: ["fast", "balanced", "best"], required: true,
          description: "Speed versus accuracy" },
        { key: "reports", type: "bool", default: false, required: false,
          description: "Also write a page about each capture" },
        { key: "options", type: "string", default: "", required: false,
          description: "Further options of the command scope capture, separated by spaces" },
        // Job compilers cannot list folders; Blender does it when the job is submitted.
        { key: "clips", type: "string", required: true, visible: "hidden",
          eval: "'\\n'.join(sorted(str(p) for p in Path(abspath(settings.folder)).iterdir() if p.is_file() "
              + "and not p.name.startswith('.') and p.suffix[1:].lower() in '" + SUFFIXES + "'.split()))",
          description: "The clips, one per line" },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    const formats = settings.formats.split(",").map(text => text.trim()).filter(text => text);
    const clips = settings.clips.split("\n").filter(text => text);
    if (!clips.length) throw "there is no footage in " + settings.folder;
    if (!formats.length) throw "the list of formats is empty; give for example npz,glb";

    const names = resultNames(clips);
    clips.forEach((clip, k) => {
        const target = path.join(settings.out, names[k]);
        const args = ["--background", "--command", "scope", "capture", clip, "--quiet", "--quality", settings.quality];
        formats.forEach(format => args.push("-o", `${target}.${format}`));
        if (settings.reports) args.push("--report", `${target}.report.html`);
        args.push(...(settings.options || "").split(" ").filter(text => text));

        const task = author.Task(names[k], "blender");
        task.addCommand(author.Command("exec", { exe: "{blender}", args: args }));
        job.addTask(task);
    });
}

// The names of the clips without suffix, or with it where two would be the same, as on file systems without case.
function resultNames(clips) {
    const count = new Map();
    for (const clip of clips) {
        const stem = path.stem(clip).toLowerCase();
        count.set(stem, (count.get(stem) || 0) + 1);
    }
    const names = clips.map(clip => count.get(path.stem(clip).toLowerCase()) > 1 ? path.basename(clip) : path.stem(clip));
    const unique = new Set(names.map(name => name.toLowerCase()));
    if (unique.size < names.length) throw "the results of two clips would have the same name; rename one of: " + names.join(", ");
    return names;
}
