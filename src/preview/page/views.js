// The views of a render: names, meanings, and how they are shown.

export const VIEW_NAMES = {
  filtered: "Filtered", raw: "Unfiltered", samples: "Samples", error: "Error", variance: "Variance",
  residual: "Residual", failure: "Interpolation", albedo: "Albedo", normal: "Normal",
  reference: "Reference", difference: "Difference", flip: "FLIP",
};
export const VIEW_TITLES = {
  filtered: "The filtered image",
  raw: "The mean of the samples",
  samples: "Samples per pixel",
  error: "Estimated relative squared error of the filtered pixel",
  variance: "Relative variance of the unfiltered pixel's mean",
  residual: "Change by the filter, relative to the expected noise; above 1 the filter blurs",
  failure: "Fraction of windows where the interpolation of feature weights failed",
  albedo: "Albedo of the first hit",
  normal: "Shading normal of the first hit",
  reference: "The reference image",
  difference: "Squared difference of the filtered image from the reference, relative as in relMSE",
  flip: "Visible difference of the filtered image from the reference (FLIP)",
};

// Views that come from a filter pass.
export const FILTERED = ["filtered", "error", "residual", "failure", "difference", "flip"];

// How a view becomes a colour, as in the shader's `kinds`: 0 radiance, 1 reflectance, 2 direction, 3 map. Saved images are
// radiance.
export function kindOf(view) {
  if (view.startsWith("save:")) return 0;
  return { filtered: 0, raw: 0, reference: 0, albedo: 1, normal: 2 }[view] ?? 3;
}
