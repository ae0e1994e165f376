// A program of Fast DDS alone, told by lines what to do; prints a line of what happens.
//   listen TOPIC TYPE reliable|best_effort latched|volatile     bytes of every message, in hexadecimal
//   publish TOPIC TYPE reliable|best_effort latched|volatile
//   joints TOPIC FRAME SEC NANOSEC NAMES POSITIONS              lists with commas
//   text TOPIC FRAME STRING                                     crtk_msgs/StringStamped
//   bytes TOPIC HEX
#include <iostream>
#include <map>
#include <mutex>
#include <sstream>

#include "messages.hpp"
#include "participant.hpp"

static std::mutex printing;

static void say(const std::string& line) {
    std::lock_guard<std::mutex> lock(printing);
    std::cout << line << std::endl;
}

struct Listening : DataReaderListener {
    std::string topic;
    void on_data_available(DataReader* reader) override {
        Bytes bytes;
        SampleInfo info;
        while (reader->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK) {
            if (!info.valid_data) continue;
            std::ostringstream line;
            line << "got " << topic << ' ' << std::hex;
            for (int byte : bytes.data) line << (byte >> 4) << (byte & 15);
            say(line.str());
        }
    }
    void on_subscription_matched(DataReader*, const SubscriptionMatchedStatus& status) override {
        say("publishers " + topic + ' ' + std::to_string(status.current_count));
    }
    void on_requested_incompatible_qos(DataReader*, const RequestedIncompatibleQosStatus& status) override {
        say("incompatible " + topic + ' ' + std::to_string(status.last_policy_id));
    }
};

struct Publishing : DataWriterListener {
    std::string topic;
    void on_publication_matched(DataWriter*, const PublicationMatchedStatus& status) override {
        say("subscribers " + topic + ' ' + std::to_string(status.current_count));
    }
    void on_offered_incompatible_qos(DataWriter*, const OfferedIncompatibleQosStatus& status) override {
        say("incompatible " + topic + ' ' + std::to_string(status.last_policy_id));
    }
};

template <class T> static std::vector<T> listed(const std::string& text) {
    std::vector<T> found;
    std::istringstream words(text);
    for (std::string word; std::getline(words, word, ',');) {
        T value;
        if (std::istringstream(word) >> value) found.push_back(value);
    }
    return found;
}

static TypeSupport type_of(const std::string& name, bool is_raw) {
    if (!is_raw && name == JointState::type) return TypeSupport(new MessageType<JointState>);
    if (!is_raw && name == StringStamped::type) return TypeSupport(new MessageType<StringStamped>);
    return TypeSupport(new BytesType(name));
}

int main(int, char** arguments) {
    DomainParticipant* participant = join(std::stoi(arguments[1]));
    Subscriber* subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
    Publisher* publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
    std::map<std::string, DataWriter*> writers;
    say("ready");
    for (std::string line; std::getline(std::cin, line);) {
        std::istringstream words(line);
        std::string verb, topic;
        words >> verb >> topic;
        if (verb == "listen" || verb == "publish") {
            std::string type, reliable, latched, raw;
            words >> type >> reliable >> latched >> raw;
            TypeSupport support = type_of(type, verb == "listen" || raw == "raw");
            support.register_type(participant);
            Topic* made = participant->create_topic(topic, type, TOPIC_QOS_DEFAULT);
            bool is_reliable = reliable == "reliable", is_latched = latched == "latched";
            if (verb == "listen") {
                auto* listening = new Listening;
                listening->topic = topic;
                subscriber->create_datareader(
                    made, quality(DATAREADER_QOS_DEFAULT, is_reliable, is_latched, 1000), listening);
            } else {
                auto* publishing = new Publishing;
                publishing->topic = topic;
                writers[topic] = publisher->create_datawriter(
                    made, quality(DATAWRITER_QOS_DEFAULT, is_reliable, is_latched, is_latched ? 1 : 1000), publishing);
            }
        } else if (verb == "joints") {
            JointState message;
            std::string names, positions;
            words >> message.header.frame_id >> message.header.sec >> message.header.nanosec >> names >> positions;
            message.name = listed<std::string>(names);
            message.position = listed<double>(positions);
            writers.at(topic)->write(&message);
        } else if (verb == "text") {
            StringStamped message;
            words >> message.header.frame_id >> message.string;
            writers.at(topic)->write(&message);
        } else if (verb == "bytes") {
            Bytes message;
            std::string hex;
            words >> hex;
            for (size_t k = 0; k + 1 < hex.size(); k += 2) {
                message.data.push_back(static_cast<uint8_t>(std::stoi(hex.substr(k, 2), nullptr, 16)));
            }
            writers.at(topic)->write(&message);
        }
    }
    participant->delete_contained_entities();
    DomainParticipantFactory::get_instance()->delete_participant(participant);
}
