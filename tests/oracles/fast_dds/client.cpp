// A client of Fast DDS alone that enables, homes, moves and reads an arm by CRTK: client DOMAIN NAMESPACE.
// Prints a line for each step; ends with 1 where a step does not come in time.
#include <atomic>
#include <chrono>
#include <cmath>
#include <functional>
#include <iomanip>
#include <iostream>
#include <mutex>
#include <thread>

#include "messages.hpp"
#include "participant.hpp"

template <class Message> class Latest : DataReaderListener {
    Message message_;
    std::mutex lock_;
    std::atomic<int> count_{0};
    void on_data_available(DataReader* reader) override {
        Message message;
        SampleInfo info;
        while (reader->take_next_sample(&message, &info) == ReturnCode_t::RETCODE_OK) {
            if (!info.valid_data) continue;
            std::lock_guard<std::mutex> lock(lock_);
            message_ = message;
            ++count_;
        }
    }

  public:
    Latest(DomainParticipant* participant, const std::string& topic, bool is_latched) {
        TypeSupport(new MessageType<Message>).register_type(participant);
        Topic* made = participant->create_topic(topic, Message::type, TOPIC_QOS_DEFAULT);
        Subscriber* subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
        subscriber->create_datareader(made, quality(DATAREADER_QOS_DEFAULT, true, is_latched, 10), this);
    }
    Message get() {
        std::lock_guard<std::mutex> lock(lock_);
        return message_;
    }
    int count() const { return count_; }
};

template <class Message> class Commander : DataWriterListener {
    DataWriter* writer_;
    std::atomic<int> listeners_{0};
    void on_publication_matched(DataWriter*, const PublicationMatchedStatus& status) override {
        listeners_ = status.current_count;
    }

  public:
    Commander(DomainParticipant* participant, const std::string& topic) {
        TypeSupport(new MessageType<Message>).register_type(participant);
        Topic* made = participant->create_topic(topic, Message::type, TOPIC_QOS_DEFAULT);
        Publisher* publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
        writer_ = publisher->create_datawriter(made, quality(DATAWRITER_QOS_DEFAULT, true, false, 100), this);
    }
    void send(Message message) { writer_->write(&message); }
    bool is_heard() const { return listeners_ > 0; }
};

static void await(const std::string& what, double seconds, const std::function<bool()>& claim) {
    auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (!claim()) {
        if (std::chrono::steady_clock::now() > end) {
            std::cout << "not " << what << std::endl;
            std::exit(1);
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    std::cout << what << std::endl;
}

static void print(const std::string& what, const std::vector<double>& numbers) {
    std::cout << what << std::setprecision(12);
    for (double number : numbers) std::cout << ' ' << number;
    std::cout << std::endl;
}

int main(int, char** arguments) {
    const std::string place = std::string("rt") + arguments[2] + "/";
    DomainParticipant* participant = join(std::stoi(arguments[1]));
    Latest<OperatingState> state(participant, place + "operating_state", true);
    Latest<JointState> setpoint(participant, place + "setpoint_js", false);
    Latest<JointState> measured(participant, place + "measured_js", false);
    Latest<PoseStamped> pose(participant, place + "measured_cp", false);
    Commander<StringStamped> command(participant, place + "state_command");
    Commander<JointState> move(participant, place + "move_jp"), servo(participant, place + "servo_jp");
    await("connected", 60.0, [&] {
        return command.is_heard() && move.is_heard() && servo.is_heard() && state.count() && setpoint.count() &&
               measured.count() && pose.count();
    });
    StringStamped text;
    text.string = "enable";
    command.send(text);
    await("enabled", 60.0, [&] { return state.get().state == "ENABLED"; });
    text.string = "home";
    command.send(text);
    await("homed", 300.0, [&] { return state.get().is_homed && !state.get().is_busy; });
    JointState goal;
    goal.position = setpoint.get().position;
    goal.position.at(0) += 0.1;
    goal.position.at(2) += 0.01;
    auto arrived = [&] {
        auto here = setpoint.get().position;
        for (size_t j = 0; j < goal.position.size(); ++j) {
            if (std::abs(here[j] - goal.position[j]) > 1e-9) return false;
        }
        return !state.get().is_busy;
    };
    move.send(goal);
    await("moved", 60.0, arrived);
    const double start = goal.position[0];
    for (int tick = 1; tick <= 500; ++tick) {  // a second of a sine, 500 times a second
        goal.position[0] = start + 0.035 * (1.0 - std::cos(2.0 * M_PI * tick / 500.0));
        servo.send(goal);
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    await("servoed", 60.0, arrived);
    std::this_thread::sleep_for(std::chrono::seconds(1));
    print("goal", goal.position);
    print("measured", measured.get().position);
    auto tip = pose.get();
    print("tip", {tip.position[0], tip.position[1], tip.position[2]});
    text.string = "disable";
    command.send(text);
    await("disabled", 60.0, [&] { return state.get().state == "DISABLED"; });
    std::_Exit(0);  // without a goodbye, as one that is killed
}
