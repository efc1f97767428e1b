#pragma once

#include <boost/make_shared.hpp>
#include <boost/shared_ptr.hpp>
#include <vector>

namespace knav {

/// Messages that are published as shared pointers and used again once nobody holds them: no allocation per
/// frame.
template <class Message>
class MessagePool {
 public:
  /// One that is ours alone. Its fields still hold what they held last.
  boost::shared_ptr<Message> take() {
    for (const boost::shared_ptr<Message>& message : messages_) {
      if (message.use_count() == 1) return message;
    }
    auto message = boost::make_shared<Message>();
    if (messages_.size() < kLargest) messages_.push_back(message);
    return message;
  }

 private:
  static constexpr std::size_t kLargest = 16;
  std::vector<boost::shared_ptr<Message>> messages_;
};

}  // namespace knav
