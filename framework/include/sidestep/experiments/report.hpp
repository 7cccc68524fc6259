#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/runtime/experiment.hpp>

namespace sidestep {

/// Draws the pictures of a run and writes report.html, which holds them all, from what the run
/// left in its folder: summary.json, results.sqlite, effective_config.yaml. The pictures are
/// written beside it as PNG. Fails with kNotFound where the folder holds no run, kIo where its
/// files are damaged or nothing can be written. [main]
[[nodiscard]] Result<void> write_report(const std::filesystem::path& run, Host& host);

/// Writes summary.json and, where there is a table for a spreadsheet, table.csv into the folder of
/// a run, then the report of it, which shows the results and the configuration that lie there.
[[nodiscard]] Result<void> save_outcome(const ExperimentOutcome& outcome,
                                        const std::filesystem::path& run, Host& host);

/// A table that compares several runs, for a terminal; and the same as a self-contained page in
/// `html`, which may be empty for none. Fails as write_report() does.
[[nodiscard]] Result<std::string> compare_runs(const std::vector<std::filesystem::path>& runs,
                                               const std::filesystem::path& html, Host& host);

/// Whether each of these folders holds a shard of a run.
[[nodiscard]] bool are_shards(const std::vector<std::filesystem::path>& runs);

/// Puts shards of one run together in the folder `out`: the same files, but for times, that the run
/// would have left there as a whole. Some may be missing, which the outcome says. Fails with
/// kConfig where they are not of one run, by one build, each once, and as write_report() does.
[[nodiscard]] Result<ExperimentOutcome> merge_shards(const std::vector<std::filesystem::path>& runs,
                                                     const std::filesystem::path& out, Host& host);

/// The reference page of results, in Markdown: for each experiment whose results have rows, the
/// keys of a row and what they say.
[[nodiscard]] Result<std::string> results_markdown(Host& host);

}  // namespace sidestep
