#include "recorded_frames.hpp"

#include <exception>
#include <sstream>

#include <sidestep/core/file.hpp>

namespace sidestep::recorded_frames {

Result<void> for_each_line(const std::filesystem::path& file, const HandleWords& handle) {
  std::istringstream stream(SIDESTEP_TRY(read_file(file)));
  int number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++number;
    std::istringstream words_of(line.substr(0, line.find('#')));
    std::vector<std::string> words;
    for (std::string word; words_of >> word;) words.push_back(word);
    if (words.empty()) continue;
    SIDESTEP_TRY(handle(words, file.string() + ":" + std::to_string(number)));
  }
  return {};
}

FrameTally::~FrameTally() {
  try {
    tell();
  } catch (const std::exception&) {  // no memory: nothing can be said
  }
}

void FrameTally::tell() {
  if (handed_out_ + unusable_ == 0) return;
  std::string text = recording_ + ": " + std::to_string(handed_out_) + " of " +
                     std::to_string(total_) + " frames handed out, " + std::to_string(unusable_) +
                     " unusable";
  for (const auto& [what, count] : left_out_) {
    if (count > 0) text += ", " + std::to_string(count) + " " + what;
  }
  log_.debug(text);
  handed_out_ = unusable_ = 0;
}

}  // namespace sidestep::recorded_frames
