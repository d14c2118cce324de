// A job type of Flamenco: shards of an image, then a task that merges and denoises them. Put it into the folder `scripts` of
// Flamenco's manager; `prpf` has to be on the path of the workers.

const JOB_TYPE = {
    label: "prpf in shards",
    description: "Render an image in shards on several workers, then merge and denoise them",
    settings: [
        { key: "scene", type: "string", subtype: "file_path", required: true, description: "Scene file" },
        { key: "image", type: "string", subtype: "file_path", required: true, description: "Denoised image, .exr or .png" },
        { key: "folder", type: "string", subtype: "dir_path", required: true, description: "Folder that all workers share, for the states" },
        { key: "shards", type: "int32", default: 8, description: "Number of shards, at least 2" },
        { key: "spp", type: "int32", default: 256, description: "Samples per pixel of the whole image, at least two for each shard" },
    ],
};

function compileJob(job) {
    const { scene, image, folder, shards, spp } = job.settings;
    const prpf = (args) => author.Command("exec", { exe: "prpf", args });

    const merge = author.Task("merge", "misc");
    const states = [];
    for (let shard = 1; shard <= shards; shard++) {
        const state = `${folder}/${shard}.state`;
        states.push(state);
        const render = author.Task(`shard-${shard}`, "misc");
        render.addCommand(prpf([
            "render", scene, "--shard", `${shard}/${shards}`, "--spp", String(spp), "--sampling", "uniform",
            "--denoiser", "none", "--state", state, "--resume", "--outfile", `${folder}/${shard}.png`,
        ]));
        job.addTask(render);
        merge.addDependency(render);
    }
    const sum = `${folder}/all.state`;
    merge.addCommand(prpf(["merge", ...states, "--outfile", sum]));
    merge.addCommand(prpf(["denoise", sum, "--denoiser", "learned", "--outfile", image]));
    job.addTask(merge);
}
